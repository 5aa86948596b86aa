"""Study of the robots that laboratories have: models, recoveries, exactness, table and films."""
