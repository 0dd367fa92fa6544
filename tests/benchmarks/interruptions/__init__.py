"""The benchmark `interruptions`: kills, full disks and limits in the middle of commands."""
