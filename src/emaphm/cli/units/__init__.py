"""The verbs on units and fleets: their history, requirements, life, and watching them in service."""
