"""Click_Objects_Order and Click_Bell_Clockwise_Order: clicks in a given order."""
