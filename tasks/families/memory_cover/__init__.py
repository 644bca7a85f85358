"""Remember_Color_Cover: covers come over coloured blocks and are opened by colour."""
