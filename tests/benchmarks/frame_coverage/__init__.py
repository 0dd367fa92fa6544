"""Intervals of frames whose truth another mesh or another program made."""

from pathlib import Path

BUILDING = Path(__file__).with_name("three_story_frame.toml")
