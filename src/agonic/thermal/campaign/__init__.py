"""A campaign in a climatic chamber: planned, described, recorded, and checked against its plan."""
