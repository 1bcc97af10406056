"""The contract between the nodes: what is published, under which name, in which form.

``records`` and ``tables`` declare every table once; ``schema`` turns records into tables of doubles and back;
``codes`` has the causes of exclusions; ``topics`` and ``qos`` say where and how things travel; ``events`` are JSON
objects; ``joining`` brings streams together by epoch; ``ros`` and ``cdr`` are the only places that meet std_msgs.
"""
