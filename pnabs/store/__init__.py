"""The run folder: Zarr arrays, the ledger, abstractions, metrics, events."""
