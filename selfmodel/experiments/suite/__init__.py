"""The study of dm_control's suite: every body, its failures, its recovery."""
