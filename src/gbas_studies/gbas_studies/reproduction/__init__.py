"""Reproduction of published results: what a paper prints, what we get, by which definition, and the verdict.

A study is a function ``reproduce(options) -> Reproduction`` in a module of its own. It is entered in
:mod:`~gbas_studies.reproduction.registry`, and everything else is common: the command ``gbas reproduce``, its table,
``results.json``, ``report.html`` and the pictures.

===============================  ==============================================================================
:mod:`~.items`                   one reproduced value or claim, its verdict; sections; the whole of a study
:mod:`~.registry`                the studies there are, and how one is run
:mod:`~.drawing`                 figures in one style
:mod:`~.report`                  ``results.json``, ``report.html``, pictures and their data as CSV
===============================  ==============================================================================

The verdict is never declared. It follows from the digits the paper prints and the value computed: see
:class:`~gbas_studies.reproduction.items.Value`.
"""
