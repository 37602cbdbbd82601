// What dynamic_reconfigure's generator makes of InflationPlugin.cfg, as far as inflation_layer.cpp reads it.
#pragma once

namespace costmap_2d {

struct InflationPluginConfig {
  bool enabled, inflate_unknown;
  double inflation_radius, cost_scaling_factor;
};

}  // namespace costmap_2d
