"""Roadfix's logs (LCM event logs) as NumPy arrays per channel, without LCM.

    import roadfix_log
    log = roadfix_log.read("drive.lcm")
    pose = log["POSE_INS"]
    east = pose.position_m[:, 0]
"""
from .events import Damage, LogError
from .frames import anchor, change_anchor
from .ragged import Ragged
from .reader import Channel, Log, read
from .schema import Schema, SchemaError

__all__ = ["Channel", "Damage", "Log", "LogError", "Ragged", "Schema", "SchemaError", "anchor", "change_anchor", "read"]
