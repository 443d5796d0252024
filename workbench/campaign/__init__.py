"""Campaigns: a plan of many pixel-to-transform trials on all cores or a cluster, resumable, always the same bytes."""
