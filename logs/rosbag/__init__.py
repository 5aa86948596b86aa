"""Import of rosbag2 recordings as trial logs, without ROS."""
