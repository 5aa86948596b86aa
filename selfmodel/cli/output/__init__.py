"""Tables, reports and progress of the command line."""
