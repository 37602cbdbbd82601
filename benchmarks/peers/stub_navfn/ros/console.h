// navfn only logs.
#pragma once
#define ROS_DEBUG(...)
#define ROS_INFO(...)
#define ROS_WARN(...)
#define ROS_ERROR(...)
