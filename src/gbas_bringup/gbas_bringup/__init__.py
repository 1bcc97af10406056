"""Starting the nodes: configurations, launcher, launch files, and what the processes need around them."""

__version__ = "0.1.0"
