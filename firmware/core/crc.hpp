#pragma once
#include <stdint.h>

namespace fw {

constexpr uint16_t kCrcInit = 0xFFFF;
/// A frame carries the complemented CRC (CRC-16/X-25). Computed over the data and that CRC, low byte first,
/// the result is this residue and never 0. With a plain CRC, a frame that lost its last byte would still pass
/// whenever that byte was 0.
constexpr uint16_t kFrameResidue = 0xF0B8;

/// Add one byte to a CRC-16/MCRF4XX: polynomial 0x1021 reflected, no table (same form as avr-libc's
/// `_crc_ccitt_update`). Computed over data followed by its own CRC, low byte first, the result is 0.
constexpr uint16_t Crc16(uint16_t crc, uint8_t byte) {
  const uint8_t x = static_cast<uint8_t>(byte ^ crc);
  const uint8_t y = static_cast<uint8_t>(x ^ (x << 4));
  return static_cast<uint16_t>(((uint16_t(y) << 8) | (crc >> 8)) ^ (y >> 4) ^ (uint16_t(y) << 3));
}

}  // namespace fw
