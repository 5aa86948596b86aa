"""The paper's experiment on its two robots, beside what the paper reports."""
