"""Press_Stapler_Repeat, Lift_Pot_Repeat, Lift_Fan_Repeat, Click_Bell_Repeat: so many times."""
