"""Many independent trials: in this process, in local workers, or on a cluster, with the same result.

A study says what its trials are, what they share, and what one trial is (:class:`~.plan.Campaign`);
:func:`~.running.run` gives the results in the order of the trials, wherever they were made:

==========================  ==================================================================================
:mod:`~.plan`               a campaign, its hash, and the seed of each trial
:mod:`~.version`            which suite makes the trials, to the last line of source
:mod:`~.work`               what a worker does: what trials share is made once in each
:mod:`~.store`              the file of results: JSON lines that a later run continues
:mod:`~.executors`          this process, or workers of dask
:mod:`~.local_worker`       Ctrl-C and local workers
:mod:`~.running`            all of it
==========================  ==================================================================================

dask is imported only where it is used.
"""

from gbas_studies.campaign.plan import Campaign
from gbas_studies.campaign.running import Execution, run

__all__ = ["Campaign", "Execution", "run"]
