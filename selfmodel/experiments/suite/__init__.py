"""Study of recoveries of many bodies: dm_control's suite, the paper's robots, users' files."""
