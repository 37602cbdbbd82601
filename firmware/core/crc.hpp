#pragma once
#include <stdint.h>

namespace fw {

constexpr uint16_t kCrcInit = 0xFFFF;
/// A frame carries the complement (CRC-16/X-25): over data and that, low byte first, the result is this and
/// never 0. With the plain CRC a frame that lost its last byte would still check whenever that byte was 0.
constexpr uint16_t kFrameResidue = 0xF0B8;

/// One byte of CRC-16/MCRF4XX: 0x1021 reflected, without a table (the shape of avr-libc's
/// `_crc_ccitt_update`). Over data followed by its own CRC, low byte first, the result is 0.
constexpr uint16_t Crc16(uint16_t crc, uint8_t byte) {
  const uint8_t x = static_cast<uint8_t>(byte ^ crc);
  const uint8_t y = static_cast<uint8_t>(x ^ (x << 4));
  return static_cast<uint16_t>(((uint16_t(y) << 8) | (crc >> 8)) ^ (y >> 4) ^ (uint16_t(y) << 3));
}

}  // namespace fw
