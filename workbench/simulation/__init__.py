"""Recordings, replay and the generated crossing: a monitor tried where nothing can be hurt."""
