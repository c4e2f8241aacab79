"""Moments as files write them, as seconds since an epoch."""
