"""The paper's three arbiters, one file each; `weighing` is the sum of III-F that two of them maximise."""
