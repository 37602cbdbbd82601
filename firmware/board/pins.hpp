#pragma once
// The pin map of the board that is built for: namespace pins, one file a board (docs/porting.md).
#if defined(THUMPER_BOARD_NANO)
#include "board/nano.hpp"
#else
#include "board/trex.hpp"
#endif
