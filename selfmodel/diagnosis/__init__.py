"""The diagnostic EA: which hypothesis explains the logged trials."""
