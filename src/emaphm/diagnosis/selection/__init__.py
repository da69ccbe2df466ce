"""What is estimated though nobody asked: nuisances, errors of sensors, laws."""
