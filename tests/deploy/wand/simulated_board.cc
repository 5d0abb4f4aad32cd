// SPDX-License-Identifier: Apache-2.0
#include "tests/deploy/wand/simulated_board.h"

#include <gtest/gtest.h>
#include <simavr/avr_adc.h>
#include <simavr/avr_eeprom.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_cycle_timers.h>
#include <simavr/sim_hex.h>

#include <array>
#include <cstdlib>

namespace rigcal::testing {
namespace {

constexpr uint32_t kClockHz = 16'000'000;
constexpr uint32_t kSupplyMv = 5000;
constexpr uint32_t kButtonBit = 2;
constexpr uint32_t kEepromBytes = 1024;
constexpr double kTwiceS = 2.5 / kClockHz;  // two switches of a pin that are one

struct PinPlace {
  char port;
  int bit;
  bool toggles;  // on the matches of a compare unit
};
constexpr std::array<PinPlace, 5> kPins = {PinPlace{'D', 3, true}, PinPlace{'D', 6, false},
                                           PinPlace{'B', 1, true}, PinPlace{'B', 2, true},
                                           PinPlace{'B', 5, false}};

}  // namespace

struct SimulatedBoard::Simulation {
  struct Pin {
    Simulation* owner = nullptr;
    PinPlace place{};
    PinTrace changes;
  };

  avr_t* avr = nullptr;
  std::array<Pin, kPins.size()> pins;
  std::string output;

  ~Simulation() {
    if (avr == nullptr) return;
    avr_terminate(avr);
    std::free(avr);
  }
  double TimeS() const { return static_cast<double>(avr->cycle) / kClockHz; }

  // An input drives nothing, whatever a compare unit of simavr says. Of other pins simavr does not
  // tell when they become outputs.
  bool IsOutput(const PinPlace& place) const {
    if (!place.toggles) return true;
    avr_ioport_state_t state{};
    avr_ioctl(avr, static_cast<uint32_t>(AVR_IOCTL_IOPORT_GETSTATE(place.port)), &state);
    return (state.ddr >> place.bit & 1) != 0;
  }
  // The pin has the level of its last change again.
  static avr_cycle_count_t TakeBack(avr_t*, avr_cycle_count_t, void* user) {
    const auto* const pin = static_cast<const Pin*>(user);
    avr_raise_irq(pin->owner->Port(pin->place.port, static_cast<uint32_t>(pin->place.bit)),
                  AVR_IOPORT_OUTPUT | (pin->changes.back().high ? 1 : 0));
    return 0;
  }
  // simavr reports a pin several times within one cycle; the last level is the one that it has. It
  // counts a match twice if the program writes to the timer's other compare register in that very
  // cycle: no firmware here switches a pin so fast, so the second one is taken back.
  static void OnPin(avr_irq_t*, uint32_t value, void* user) {
    auto* const pin = static_cast<Pin*>(user);
    const PinChange now{pin->owner->TimeS(), (value & 1) != 0 && pin->owner->IsOutput(pin->place)};
    PinTrace& changes = pin->changes;
    if (!changes.empty() && changes.back().time_s == now.time_s) changes.pop_back();
    const bool was_high = !changes.empty() && changes.back().high;
    if (now.high == was_high) return;
    if (pin->place.toggles && !changes.empty() && now.time_s - changes.back().time_s < kTwiceS) {
      avr_cycle_timer_register(pin->owner->avr, 1, TakeBack, pin);
      return;
    }
    changes.push_back(now);
  }
  static void OnByte(avr_irq_t*, uint32_t value, void* user) {
    static_cast<Simulation*>(user)->output += static_cast<char>(value);
  }

  avr_irq_t* Port(char port, uint32_t bit) const {
    return avr_io_getirq(avr, static_cast<uint32_t>(AVR_IOCTL_IOPORT_GETIRQ(port)),
                         static_cast<int>(bit));
  }
  // Whatever pulls at the pin from outside wins over the pull-up, also when the port is written to.
  void SetButton(bool released) {
    avr_ioport_external_t outside{};
    outside.name = 'D';
    outside.mask = 1u << kButtonBit;
    outside.value = released ? outside.mask : 0;
    avr_ioctl(avr, static_cast<uint32_t>(AVR_IOCTL_IOPORT_SET_EXTERNAL('D')), &outside);
    avr_raise_irq(Port('D', kButtonBit), released ? 1 : 0);
  }
  avr_irq_t* Uart(int number) const {
    return avr_io_getirq(avr, static_cast<uint32_t>(AVR_IOCTL_UART_GETIRQ('0')), number);
  }
};

SimulatedBoard::SimulatedBoard(const std::string& firmware, const std::vector<uint8_t>& eeprom)
    : simulation_(std::make_unique<Simulation>()) {
  const std::string path = std::string(RIGCAL_FIRMWARE_DIR) + "/" + firmware + ".hex";
  uint32_t size = 0, start = 0;
  uint8_t* const code = read_ihex_file(path.c_str(), &size, &start);
  if (code == nullptr) {
    ADD_FAILURE() << path << " cannot be read";
    std::abort();  // nothing else of this test has a meaning
  }
  avr_t* const avr = simulation_->avr = avr_make_mcu_by_name("atmega328p");
  avr_init(avr);
  avr->log = LOG_NONE;
  avr->frequency = kClockHz;
  avr->vcc = avr->avcc = avr->aref = kSupplyMv;
  avr->sleep = [](avr_t*, avr_cycle_count_t) {};  // time passes only in the simulation
  avr_loadcode(avr, code, size, start);
  avr->codeend = avr->flashend;
  std::free(code);
  if (!eeprom.empty()) {
    std::vector<uint8_t> bytes = eeprom;
    avr_eeprom_desc_t all{bytes.data(), 0, static_cast<uint32_t>(bytes.size())};
    avr_ioctl(avr, static_cast<uint32_t>(AVR_IOCTL_EEPROM_SET), &all);
  }
  // Else simavr looks in every cycle whether LED 3's pin, which could be an interrupt, is low.
  avr_extint_set_strict_lvl_trig(avr, 0, 0);
  avr_extint_set_strict_lvl_trig(avr, 1, 0);
  uint32_t uart_flags = 0;  // it prints nothing by itself
  avr_ioctl(avr, static_cast<uint32_t>(AVR_IOCTL_UART_SET_FLAGS('0')), &uart_flags);

  for (size_t i = 0; i < kPins.size(); ++i) {
    simulation_->pins[i].owner = simulation_.get();
    simulation_->pins[i].place = kPins[i];
    avr_irq_register_notify(simulation_->Port(kPins[i].port, static_cast<uint32_t>(kPins[i].bit)),
                            Simulation::OnPin, &simulation_->pins[i]);
  }
  avr_irq_register_notify(simulation_->Uart(UART_IRQ_OUTPUT), Simulation::OnByte,
                          simulation_.get());
  simulation_->SetButton(true);
  SetBatteryMv(4000);
}

SimulatedBoard::~SimulatedBoard() = default;

double SimulatedBoard::time_s() const { return simulation_->TimeS(); }

void SimulatedBoard::Run(double seconds) {
  const auto end = simulation_->avr->cycle + static_cast<avr_cycle_count_t>(seconds * kClockHz);
  while (simulation_->avr->cycle < end) {
    const int state = avr_run(simulation_->avr);
    if (state == cpu_Done || state == cpu_Crashed) {
      ADD_FAILURE() << "the firmware has crashed at " << time_s() << " s";
      return;
    }
  }
}

void SimulatedBoard::Press(double seconds) {
  simulation_->SetButton(false);
  Run(seconds);
  simulation_->SetButton(true);
  Run(0.1);
}

std::string SimulatedBoard::Send(const std::string& line) {
  TakeOutput();
  for (const char c : line + "\r") {
    avr_raise_irq(simulation_->Uart(UART_IRQ_INPUT), static_cast<uint8_t>(c));
    Run(0.0005);  // a byte at 38400 baud takes 0.26 ms
  }
  Run(0.3);
  std::string answer = TakeOutput();
  const size_t echo_end = answer.find("\r\n");
  return echo_end == std::string::npos ? answer : answer.substr(echo_end + 2);
}

std::string SimulatedBoard::TakeOutput() { return std::exchange(simulation_->output, {}); }

void SimulatedBoard::SetBatteryMv(uint32_t millivolts) {
  avr_raise_irq(
      avr_io_getirq(simulation_->avr, static_cast<uint32_t>(AVR_IOCTL_ADC_GETIRQ), ADC_IRQ_ADC0),
      millivolts / 2);
}

PinTrace SimulatedBoard::TraceSince(BoardPin pin, double time_s) const {
  PinTrace since;
  for (const PinChange& change : simulation_->pins[static_cast<size_t>(pin)].changes) {
    if (change.time_s >= time_s) since.push_back(change);
  }
  return since;
}

bool SimulatedBoard::IsHigh(BoardPin pin) const {
  const PinTrace& changes = simulation_->pins[static_cast<size_t>(pin)].changes;
  return !changes.empty() && changes.back().high;
}

std::vector<uint8_t> SimulatedBoard::Eeprom() const {
  std::vector<uint8_t> bytes(kEepromBytes);
  avr_eeprom_desc_t all{bytes.data(), 0, kEepromBytes};
  avr_ioctl(simulation_->avr, static_cast<uint32_t>(AVR_IOCTL_EEPROM_GET), &all);
  return bytes;
}

}  // namespace rigcal::testing
