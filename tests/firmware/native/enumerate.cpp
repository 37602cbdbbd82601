// Enumerates finite domains of the core, whole, and compares it with models that share no code with it.
//
// enumerate quadrature          every state and count, every pair of successive levels
// enumerate supervisor DEPTH    every sequence of requests, refusals and faults
// enumerate host DEPTH          every sequence of what the host interface can receive, through its frames
// enumerate framing             every cut of a frame with every byte
// enumerate streams COUNT SEED  random streams of bytes
//
// Prints how many cases it checked. Prints the first difference and exits with 1.

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "core/host_interface.hpp"
#include "core/quadrature.hpp"
#include "fakes.hpp"

namespace {

using Frame = std::vector<uint8_t>;
uint64_t cases = 0;

[[noreturn]] void Fail(const std::string& what) {
  std::printf("%s\n", what.c_str());
  std::exit(1);
}

void Check(bool right, const char* what, const std::vector<int>& sequence) {
  if (right) return;
  std::string text = std::string(what) + " after";
  for (const int event : sequence) text += " " + std::to_string(event);
  Fail(text);
}

// Quadrature ------------------------------------------------------------------------------------------------

void Quadrature() {
  constexpr int kPosition[4] = {0, 1, 3, 2};  // along a forward turn, of B << 1 | A
  using Decoder = fw::QuadratureDecoder<0x30>;
  for (int count = 0; count < 0x10000; ++count) {
    for (int pair = 0; pair < 64; ++pair) {
      Decoder decoder;
      const int start = pair & 3;
      decoder.Reset(static_cast<uint8_t>(start << 4));
      decoder.low_ = decoder.lost_low_ = static_cast<uint8_t>(count);
      decoder.high_ = decoder.lost_high_ = static_cast<uint8_t>(count >> 8);
      int travel = count, lost = count, last = start;
      for (const int next : {pair >> 2 & 3, pair >> 4}) {
        const int others = (count * 7 + pair) & 0xCF;  // the port's other pins
        decoder.Step(static_cast<uint8_t>(next << 4 | others));
        const int moved = (kPosition[next] - kPosition[last] + 4) % 4;
        travel += moved == 1 ? 1 : moved == 3 ? -1 : 0;
        lost += moved == 2;
        last = next;
      }
      Check(decoder.count() == uint16_t(travel) && decoder.lost() == uint16_t(lost), "count", {count, pair});
      ++cases;
    }
  }
}

// Supervisor ------------------------------------------------------------------------------------------------

enum Mode { kOff, kLoop, kManual, kFault };  // as in the safety case, in the wire's order
constexpr int kNone = 0, kLink = 1, kLow = 2, kEStop = 3;

/// The state table and the order of faults, as docs/explanation/firmware.md states them.
struct Model {
  int mode = kOff, fault = kNone;

  void Trip(int number, bool at_rest_too) {
    if (mode == kOff && !at_rest_too) return;
    const bool first = mode != kFault;
    mode = kFault;
    if (first || number == kEStop || (number == kLow && fault != kEStop)) fault = number;
  }
  /// Return whether the request is refused because of a fault.
  bool Request(int event) {
    if (event == 2) Trip(kEStop, true);
    if (mode == kFault && event == 3) mode = kOff, fault = kNone;
    if (mode == kFault) return event == 1 || event == 4;
    if (event == 0) mode = kOff;
    if (event == 1) mode = kLoop;
    if (event == 4 && mode == kLoop) mode = kManual;
    return false;
  }
};

bool AtRestToo(int fault) {
  switch (static_cast<fw::Fault>(fault)) {
    case fw::Fault::kLowBattery:
    case fw::Fault::kEStop:
    case fw::Fault::kWatchdog:
    case fw::Fault::kBadParameters:
    case fw::Fault::kAdcStopped:
    case fw::Fault::kHighBattery:
    case fw::Fault::kInput1:
    case fw::Fault::kInput2:
      return true;
    default:
      return false;
  }
}

constexpr int kFaults = 17;  // of the protocol, without NONE
static_assert(static_cast<int>(fw::Fault::kImpact) == kFaults, "one event for each fault");

/// Events: 0 to 4 requests; 5, 6 ARM and CLEAR with an empty battery; then each fault.
void Supervise(const fw::Supervisor& before, const Model& model, int depth, std::vector<int>& sequence) {
  for (int event = 0; event < 7 + kFaults; ++event) {
    fw::Supervisor machine = before;
    Model expected = model;
    sequence.push_back(event);
    if (event < 5) {
      const bool refused = expected.Request(event);
      const auto status = machine.Handle(static_cast<fw::Event>(event), fw::AckStatus::kOk);
      Check((status == fw::AckStatus::kFaultLatched) == refused, "answer", sequence);
    } else if (event < 7) {
      const fw::Event request = event == 5 ? fw::Event::kArm : fw::Event::kClearFault;
      Check(machine.Handle(request, fw::AckStatus::kBatteryLow) == fw::AckStatus::kBatteryLow, "answer",
            sequence);
    } else {
      machine.Trip(static_cast<fw::Fault>(event - 6));
      expected.Trip(event - 6, AtRestToo(event - 6));
    }
    ++cases;
    Check(static_cast<int>(machine.state()) == expected.mode, "state", sequence);
    Check(static_cast<int>(machine.fault()) == expected.fault, "fault", sequence);
    Check(machine.armed() == (expected.mode == kLoop || expected.mode == kManual), "armed", sequence);
    if (depth > 1) Supervise(machine, expected, depth - 1, sequence);
    sequence.pop_back();
  }
}

// Host interface --------------------------------------------------------------------------------------------

template <typename Message>
Frame Encoded(const Message& message) {
  Bytes sink;
  fw::SendFrame(sink, 1, message);
  return sink.data;
}

enum HostEvent {
  kSpeeds = 5,
  kTime,
  kEmpty,
  kFull,
  kHigh,
  kNoAdc,
  kPressed,
  kReleased,
  kCurrent,
  kHostEvents
};
constexpr int kBatteryUnknown = 0, kBatteryFull = 1, kBatteryEmpty = 2, kBatteryHigh = 3;

/// What the host interface adds: time-out, battery, input, and the command of the motors.
struct HostModel : Model {
  int battery = kBatteryFull, silence_ms = 0, left = 0, right = 0;
  bool pressed = false;

  void Step(int event) {
    const int mode_before = mode;
    const bool ready = battery == kBatteryFull && !pressed;
    if (event < kSpeeds && (ready || (event != 1 && event != 3))) Request(event);
    if (mode != mode_before) Rest();
    if (event == kSpeeds && mode == kLoop) Drive(1000, -1000);
    if (event == 4 && mode == kManual) Drive(100, -50);
    if (event == kTime && (mode == kLoop || mode == kManual)) silence_ms += 200;
    if (event == kTime && silence_ms >= 300) Trip(kLink, false);
    if (event == kEmpty && battery != kBatteryEmpty) Trip(kLow, true);
    if (event == kHigh) Trip(static_cast<int>(fw::Fault::kHighBattery), true);
    if (event >= kEmpty && event <= kHigh) {
      battery = event == kEmpty ? kBatteryEmpty : event == kFull ? kBatteryFull : kBatteryHigh;
    }
    if (event == kNoAdc) battery = kBatteryUnknown;
    if (event == kNoAdc) Trip(static_cast<int>(fw::Fault::kAdcStopped), true);
    if (event == kPressed) pressed = true;
    if (event == kReleased) pressed = false;
    if (event == kPressed) Trip(static_cast<int>(fw::Fault::kInput1), true);
    if (event == kCurrent) Trip(static_cast<int>(fw::Fault::kOverCurrent), false);
    if (mode != mode_before && event != 4) Rest();
  }
  void Drive(int left_command, int right_command) {
    left = left_command;
    right = right_command;
    silence_ms = 0;
  }
  void Rest() { left = right = silence_ms = 0; }
};

void Feed(fw::HostInterface& host, const Frame& frame) {
  Bytes sink;
  for (const uint8_t byte : frame) host.Receive(byte, sink);
}

void Happen(fw::HostInterface& host, int event) {
  static const Frame kRequests[] = {Encoded(fw::CommandRequest{fw::Command::kDisarm}),
                                    Encoded(fw::CommandRequest{fw::Command::kArm}),
                                    Encoded(fw::CommandRequest{fw::Command::kEStop}),
                                    Encoded(fw::CommandRequest{fw::Command::kClearFault}),
                                    Encoded(fw::SetMotorPwm{100, -50}),
                                    Encoded(fw::SetWheelSpeeds{1000, -1000})};
  constexpr int kSettles = 100, kDebounces = 4, kTooMuch = 3;  // readings
  constexpr uint8_t kUp = 3, kDown = 2;                        // levels: input 1 low while pressed
  switch (event) {
    case kTime:
      host.AdvanceTime(200);
      break;
    case kEmpty:
    case kFull:
    case kHigh:
      for (int i = 0; i < kSettles; ++i) {
        host.UpdateBattery(event == kEmpty ? 6000 : event == kFull ? 8000 : 14000);
      }
      break;
    case kNoAdc:
      host.LoseAnalogReadings();
      break;
    case kPressed:
      for (int i = 0; i < kDebounces; ++i) host.UpdateInputs(kDown);
      break;
    case kReleased:
      host.UpdateInputs(kUp);
      break;
    case kCurrent:
      for (int i = 0; i < kTooMuch; ++i) host.UpdateCurrents(9000, 0);
      host.UpdateCurrents(0, 0);
      break;
    default:
      Feed(host, kRequests[event]);
  }
}

void Host(const fw::HostInterface& before, const HostModel& model, int depth, std::vector<int>& sequence) {
  for (int event = 0; event < kHostEvents; ++event) {
    fw::HostInterface host = before;
    HostModel expected = model;
    sequence.push_back(event);
    Happen(host, event);
    expected.Step(event);
    ++cases;
    Check(static_cast<int>(host.supervisor().state()) == expected.mode, "state", sequence);
    Check(static_cast<int>(host.supervisor().fault()) == expected.fault, "fault", sequence);
    const fw::DriveCommand& command = host.command();
    Check(static_cast<int>(command.mode) == expected.mode, "mode of the motors", sequence);
    Check(command.left == expected.left && command.right == expected.right, "command", sequence);
    if (depth > 1) Host(host, expected, depth - 1, sequence);
    sequence.pop_back();
  }
}

fw::HostInterface ChargedHost() {
  static Eeprom eeprom;
  fw::HostInterface host(fw::Board::kTrex, fw::ResetCause::kPowerOn);
  host.Start(eeprom, fw::Fault::kNone);
  Feed(host, Encoded(fw::SetParameter{static_cast<uint8_t>(fw::Parameter::kInput1), 1}));
  Happen(host, kFull);
  return host;
}

// Framing ---------------------------------------------------------------------------------------------------

constexpr std::size_t kMaxBody = 64;
using Decoder = fw::FrameDecoder<kMaxBody - 4>;

/// CRC-16/MCRF4XX, bit for bit.
uint16_t SlowCrc(const uint8_t* data, std::size_t size) {
  uint16_t crc = 0xFFFF;
  for (std::size_t bit = 0; bit < 8 * size; ++bit) {
    const bool feedback = ((crc ^ data[bit / 8] >> bit % 8) & 1) != 0;
    crc = static_cast<uint16_t>(crc >> 1 ^ (feedback ? 0x8408 : 0));
  }
  return crc;
}

Frame Cobs(const Frame& body) {
  Frame encoded;
  std::size_t start = 0;
  for (std::size_t i = 0; i <= body.size(); ++i) {
    if (i < body.size() && body[i] != 0) continue;
    encoded.push_back(static_cast<uint8_t>(i - start + 1));
    encoded.insert(encoded.end(), body.begin() + start, body.begin() + i);
    start = i + 1;
  }
  return encoded;
}

Frame WithCrc(Frame body) {
  const uint16_t crc = static_cast<uint16_t>(~SlowCrc(body.data(), body.size()));
  body.push_back(static_cast<uint8_t>(crc));
  body.push_back(static_cast<uint8_t>(crc >> 8));
  return body;
}

/// Decode what stands between two delimiters, at once. Return false unless it is a frame with a right CRC.
bool Decode(const uint8_t* data, std::size_t size, Frame* body) {
  body->clear();
  for (std::size_t at = 0; at < size;) {
    const std::size_t block = data[at];
    if (at + block > size) return false;
    body->insert(body->end(), data + at + 1, data + at + block);
    at += block;
    if (at < size && block != 0xFF) body->push_back(0);
  }
  if (body->size() < 4 || body->size() > kMaxBody) return false;
  const uint16_t crc = SlowCrc(body->data(), body->size() - 2);
  return (*body)[body->size() - 2] == uint8_t(~crc) && (*body)[body->size() - 1] == uint8_t(~crc >> 8);
}

void CheckStream(const Frame& stream) {
  static Frame body;
  Decoder decoder;
  uint16_t frames = 0, errors = 0;
  std::size_t start = 0;
  bool same = true;
  for (std::size_t i = 0; i < stream.size(); ++i) {
    const bool found = decoder.Push(stream[i]);
    if (stream[i] != 0) {
      same = same && !found;
      continue;
    }
    const bool good = i > start && Decode(&stream[start], i - start, &body);
    if (i > start) good ? ++frames : ++errors;
    start = i + 1;
    same = same && found == good && decoder.frames() == frames && decoder.errors() == errors;
    if (good) {
      same = same && decoder.id() == body[0] && decoder.seq() == body[1] &&
             decoder.payload_size() == body.size() - 4 &&
             std::memcmp(decoder.payload(), body.data() + 2, body.size() - 4) == 0;
    }
  }
  ++cases;
  if (!same) Check(false, "frames", std::vector<int>(stream.begin(), stream.end()));
}

uint32_t Random() {
  static uint64_t state = 0x9E3779B97F4A7C15ULL;
  state = state * 6364136223846793005ULL + 1442695040888963407ULL;
  return static_cast<uint32_t>(state >> 33);
}

Frame RandomBody(std::size_t size) {
  Frame body(size);
  for (uint8_t& byte : body) byte = static_cast<uint8_t>(Random() % 8 == 0 ? 0 : Random());
  return body;
}

/// For each length of body, place of a zero and place in the frame: every byte there.
void Framing() {
  const Frame next = Cobs(WithCrc({7, 8, 9}));
  for (std::size_t size = 0; size <= kMaxBody + 2; ++size) {
    for (const std::size_t zero : {size, std::size_t{0}, size / 2, size - 1}) {
      Frame body(size);
      for (std::size_t i = 0; i < size; ++i) body[i] = static_cast<uint8_t>(1 + Random() % 255);
      if (zero < size) body[zero] = 0;
      const Frame whole = Cobs(WithCrc(body));
      for (std::size_t place = 0; place <= whole.size(); ++place) {
        for (int byte = 0; byte < 256; ++byte) {
          Frame stream = whole;
          if (place == whole.size()) stream.push_back(0);
          stream[place] = static_cast<uint8_t>(byte);
          stream.push_back(0);
          stream.insert(stream.end(), next.begin(), next.end());
          stream.push_back(0);
          CheckStream(stream);
        }
      }
    }
  }
}

void Streams(uint64_t count, uint64_t seed) {
  for (uint64_t i = 0; i < seed; ++i) Random();
  for (uint64_t i = 0; i < count; ++i) {
    Frame stream;
    for (uint32_t part = 1 + Random() % 3; part > 0; --part) {
      Frame piece = Random() % 2 != 0 ? Cobs(WithCrc(RandomBody(Random() % (kMaxBody + 4)))) : Frame();
      if (piece.empty()) piece = RandomBody(Random() % 40);
      for (uint32_t damage = Random() % 4; damage > 1 && !piece.empty(); --damage) {
        const std::size_t place = Random() % piece.size();
        if (Random() % 3 == 0)
          piece.erase(piece.begin() + place);
        else
          piece[place] = static_cast<uint8_t>(Random() % 4 == 0 ? 255 : Random());
      }
      stream.insert(stream.end(), piece.begin(), piece.end());
      if (Random() % 8 != 0) stream.push_back(0);
    }
    stream.push_back(0);
    CheckStream(stream);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  const long number = argc > 2 ? std::atol(argv[2]) : 0;
  std::vector<int> sequence;
  if (what == "quadrature")
    Quadrature();
  else if (what == "supervisor")
    Supervise(fw::Supervisor(), Model(), static_cast<int>(number), sequence);
  else if (what == "host")
    Host(ChargedHost(), HostModel(), static_cast<int>(number), sequence);
  else if (what == "framing")
    Framing();
  else if (what == "streams")
    Streams(static_cast<uint64_t>(number), argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 0);
  else
    Fail("see the top of enumerate.cpp");
  std::printf("%llu\n", static_cast<unsigned long long>(cases));
  return 0;
}
