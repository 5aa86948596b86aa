"""The ROS 2 messages of a trial log: topics, layouts and definitions, encoded and decoded."""
