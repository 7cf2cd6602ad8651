"""Procedural rooms: shell, furniture, layout, materials, lights, cameras. Start at `rooms.sample_room`."""
