"""Import of recordings of ROS 1 and ROS 2 as trial logs, without ROS."""
