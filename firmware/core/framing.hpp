#pragma once
#include <stddef.h>
#include <stdint.h>

#include "core/crc.hpp"

namespace fw {

/// Streaming decoder of COBS(id, seq, payload, CRC) 0x00. Accepts any bytes and returns only complete, valid
/// frames.
template <size_t kMaxPayloadSize>
class FrameDecoder {
 public:
  /// Add one byte. Return true if it completes a valid frame, which stays readable until the next call.
  bool Push(uint8_t byte) {
    if (byte == 0) return Finish();
    if (finished_) {  // a new frame begins
      finished_ = broken_ = zero_due_ = false;
      length_ = remaining_ = 0;
    }
    if (remaining_ == 0) {  // a code byte: distance to the next zero
      if (zero_due_) Append(0);
      zero_due_ = true;  // no block of 254 bytes, after which no zero is due, fits
      remaining_ = static_cast<uint8_t>(byte - 1);
    } else {
      --remaining_;
      Append(byte);
    }
    return false;
  }

  uint8_t id() const { return body_[0]; }
  uint8_t seq() const { return body_[1]; }
  const uint8_t* payload() const { return body_ + 2; }
  uint8_t payload_size() const { return static_cast<uint8_t>(length_ - kOverhead); }
  uint16_t frames() const { return frames_; }  ///< valid frames since reset; wraps
  uint16_t errors() const { return errors_; }  ///< rejected frames since reset; wraps

 private:
  static constexpr uint8_t kOverhead = 4;  // id, seq, CRC
  static_assert(kMaxPayloadSize + kOverhead < 254, "one COBS block");

  void Append(uint8_t byte) {
    if (length_ < sizeof(body_)) {
      body_[length_++] = byte;
    } else {
      broken_ = true;  // longer than any known frame
    }
  }

  bool Finish() {
    if (finished_) return false;  // an idle delimiter
    finished_ = true;
    uint16_t crc = kCrcInit;
    for (uint8_t i = 0; i < length_; ++i) crc = Crc16(crc, body_[i]);
    const bool good = !broken_ && remaining_ == 0 && length_ >= kOverhead && crc == kFrameResidue;
    if (good) {
      ++frames_;
    } else {
      ++errors_;
    }
    return good;
  }

  uint8_t body_[kMaxPayloadSize + kOverhead];
  uint8_t length_ = 0;
  uint8_t remaining_ = 0;  // bytes before the next code byte
  bool zero_due_ = false;  // the current block ends with an implied zero, unless the frame ends with it
  bool broken_ = false;
  bool finished_ = true;
  uint16_t frames_ = 0, errors_ = 0;
};

/// Add the CRC to `body` (id, seq, payload and room for the CRC; `length` bytes in all), encode it and write
/// the frame with its delimiter to `sink.Put(uint8_t)`. length < 254: one COBS block.
template <typename Sink>
__attribute__((noinline)) void SendBody(Sink& sink, uint8_t* body, uint8_t length) {
  uint16_t crc = kCrcInit;
  // NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage): it does not see the memcpy of the telemetry's samples
  for (uint8_t i = 0; i < length - 2; ++i) crc = Crc16(crc, body[i]);
  body[length - 2] = static_cast<uint8_t>(~crc);
  body[length - 1] = static_cast<uint8_t>(~crc >> 8);

  uint8_t start = 0;
  for (;;) {  // one run of non-zero bytes per pass
    uint8_t end = start;
    while (end < length && body[end] != 0) ++end;
    sink.Put(static_cast<uint8_t>(end - start + 1));
    while (start < end) sink.Put(body[start++]);
    if (end == length) break;
    ++start;
  }
  sink.Put(0);
}

/// A message with its header and room for its CRC, the input of SendBody.
template <typename Message>
struct __attribute__((packed)) Frame {
  uint8_t id, seq;
  Message message;
  uint16_t crc;
};

/// Add the CRC to a frame whose id, seq and message are set, and send it.
template <typename Message, typename Sink>
void SendFrame(Sink& sink, Frame<Message>& frame) {
  static_assert(sizeof(Message) == Message::kSize && Message::kSize + 4 < 254, "packed, and one COBS block");
  SendBody(sink, reinterpret_cast<uint8_t*>(&frame), sizeof(frame));
}

/// Send a message as a frame.
template <typename Message, typename Sink>
void SendFrame(Sink& sink, uint8_t seq, const Message& message) {
  Frame<Message> frame = {Message::kId, seq, message, 0};
  SendFrame(sink, frame);
}

}  // namespace fw
