"""The contract between the nodes: what is published, under which name, in which form.

``records`` and ``tables`` declare every table once; ``schema`` turns records into tables of doubles and back; ``codes``
has every enumeration, ``products`` the corrections, ``modes`` what aircraft make of them, ``monitors`` the ground
station's monitors, and ``document`` makes the page of it all;
``topics`` and ``qos`` say where and how things travel; ``events`` are JSON
objects; ``joining`` brings streams together by epoch; ``ros`` and ``cdr`` are the only places that meet std_msgs.
"""
