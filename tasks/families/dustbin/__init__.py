"""Put_Bottles_Dustbin and Place_Bottle_Cup: bottles into the bin on the floor."""
