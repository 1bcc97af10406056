"""What each satellite may be used for, and the tables and events that say so."""
