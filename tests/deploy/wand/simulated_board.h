// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "tests/deploy/wand/pin_trace.h"

namespace rigcal::testing {

// Pins by the names that the boards print.
enum class BoardPin { kD3, kD6, kD9, kD10, kD13 };

// An ATmega328P board with a clock of 16 MHz and a firmware of this build in it, simulated by
// simavr. It runs only while Run, Press or Send do; time is that of its clock since power came on.
class SimulatedBoard {
 public:
  // `firmware` is the name of a .hex file without its ending, which must exist. `eeprom`: as
  // another board left it; empty: as new. The battery has 4 V.
  explicit SimulatedBoard(const std::string& firmware, const std::vector<uint8_t>& eeprom = {});
  ~SimulatedBoard();
  SimulatedBoard(const SimulatedBoard&) = delete;
  SimulatedBoard& operator=(const SimulatedBoard&) = delete;

  double time_s() const;
  void Run(double seconds);
  // Holds the button for that long, then releases it, and runs on for a tenth of a second.
  void Press(double seconds);
  // Types a line; what the board has answered 0.3 s after its end, without the echo.
  std::string Send(const std::string& line);
  // Everything that it has said since the last call, or since Send.
  std::string TakeOutput();
  // At the battery, of which the board's input has half.
  void SetBatteryMv(uint32_t millivolts);

  // The pin's changes from that time on.
  PinTrace TraceSince(BoardPin pin, double time_s) const;
  bool IsHigh(BoardPin pin) const;
  std::vector<uint8_t> Eeprom() const;

 private:
  struct Simulation;
  std::unique_ptr<Simulation> simulation_;
};

}  // namespace rigcal::testing
