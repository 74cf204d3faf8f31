"""What the parts are really like: sensors, motors and the foot, by their data sheets."""
