"""The process window: a local page in the browser for tuning detection on saved stripe images."""
