"""Many independent tasks: on processes of this machine or a Dask cluster."""
