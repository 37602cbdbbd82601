// Debian has no dynamic_reconfigure: parameters stay as they are set.
#pragma once
#include <ros/ros.h>

#include <boost/bind/bind.hpp>
#include <boost/function.hpp>

namespace dynamic_reconfigure {

template <class Config>
struct Server {
  using CallbackType = boost::function<void(Config &, uint32_t)>;
  explicit Server(const ros::NodeHandle &) {}
  void clearCallback() {}
  void setCallback(CallbackType) {}
};

}  // namespace dynamic_reconfigure
