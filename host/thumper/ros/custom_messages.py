"""Definitions of message types that ROS 2 does not have; names end in their unit."""

# The board's telemetry exactly as on the wire, so that a recording holds all of it.
WHEELS = """
std_msgs/Header header
uint32 time_us
int32 left_count
int32 right_count
int16 left_setpoint_mrad_s
int16 right_setpoint_mrad_s
int16 left_speed_mrad_s
int16 right_speed_mrad_s
int16 left_pwm
int16 right_pwm
int16 left_integral
int16 right_integral
uint16 lost_edges
uint16 battery_mv
int16 left_current_ma
int16 right_current_ma
uint8 state
uint8 fault
uint8 warnings
uint16 rx_frames
uint16 rx_errors
uint16 tx_dropped
uint16 gyro_heading
uint8 gyroscope
"""

STATUS = """
std_msgs/Header header
string robot
string mode
string reason
bool simulated
bool recording
bool recording_paused
bool has_goal
float64 goal_x_m
float64 goal_y_m
float64 goal_yaw_rad
float64 distance_to_goal_m
string board_state
uint8 fault
string fault_words
string fault_cure
float64 loop_late_s
float64 loop_busy_s
float64 telemetry_age_s
float64 scan_age_s
uint32 link_frames
uint32 link_errors
uint32 lost_edges
uint32 lidar_scans
uint32 lidar_errors
uint32 lidar_restarts
string sensors
string pose_lost
string localization
"""

# The cells of the map in a box. `before` is the stamp of the map that it changes; zero if it changes none.
MAP_CHANGE = """
std_msgs/Header header
builtin_interfaces/Time before
uint32 row
uint32 column
uint32 rows
uint32 columns
int8[] data
"""

OWN_MESSAGES = {
    "thumper_msgs/msg/Wheels": WHEELS,
    "thumper_msgs/msg/Status": STATUS,
    "thumper_msgs/msg/MapChange": MAP_CHANGE,
}
