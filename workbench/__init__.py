"""The roof: files, the command line, recording, planning, reports, campaigns and the process window."""
