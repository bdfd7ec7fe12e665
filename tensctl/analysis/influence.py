"""Static reach: how far the structure moves when rest lengths change slowly (stated in `statics.response`)."""

from tensctl.statics import static_influence, tension_influence

__all__ = ["static_influence", "tension_influence"]
