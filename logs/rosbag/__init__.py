"""Recordings of real robots: rosbag2 bags in any form, read without ROS, as trial logs."""
