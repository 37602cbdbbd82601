// What message_generation makes of Position2DInt.msg.
#pragma once
#include <cstdint>

namespace base_local_planner {

struct Position2DInt {
  int64_t x = 0, y = 0;
};

}  // namespace base_local_planner
