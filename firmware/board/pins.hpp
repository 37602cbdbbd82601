#pragma once
// Pin map of the selected board: namespace pins, one file per board (docs/howto/porting.md).
#if defined(THUMPER_BOARD_NANO)
#include "board/nano.hpp"
#else
#include "board/trex.hpp"
#endif
