"""Recordings of robots from an independent generator, and the score of their diagnoses.

The generator (all modules but ``scoring`` and ``__main__``) imports nothing of selfmodel: plain
MuJoCo, faults made in the specification of the model, and rosbag2.
"""
