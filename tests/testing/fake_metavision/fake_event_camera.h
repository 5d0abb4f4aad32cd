// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "metavision/hal/facilities/i_trigger_in.h"

namespace rigcal::testing {

struct FakeBias {
  int value = 0;
  int lowest = -100;
  int highest = 100;
  bool can_change = true;
};

// The data of a fake camera after one start of its stream.
struct FakeStream {
  enum class Then { kNothing, kEnd, kThrow };

  std::vector<std::vector<uint8_t>> pieces = {};
  Then then = Then::kNothing;
};

// Properties and behaviour of a fake camera. Functions are named as in the SDK: "I_LL_Biases::set",
// "open".
struct FakeEventCameraOptions {
  std::string serial = "00050423";
  int width = 640;
  int height = 480;
  std::string format = "EVT3";     // current; a format requested at opening overrides it
  std::string header_format = {};  // of a file's header; empty: none
  std::vector<std::string> formats = {"EVT3", "EVT21"};
  std::map<std::string, FakeBias> biases = {{"bias_fo", {}}, {"bias_hpf", {0, 0, 120, true}}};
  std::map<Metavision::I_TriggerIn::Channel, short> inputs = {
      {Metavision::I_TriggerIn::Channel::Main, 0}};
  uint32_t lowest_rate = 1000;
  uint32_t highest_rate = 50'000'000;
  std::deque<FakeStream> streams = {};      // one for each start; none after the last
  std::set<std::string> missing = {};       // facilities
  std::set<std::string> refusing = {};      // functions that return false
  std::set<std::string> throwing = {};      // functions that throw a HalException
  std::set<std::string> throwing_odd = {};  // functions that throw an int
};

class FakeEventCamera {
 public:
  explicit FakeEventCamera(FakeEventCameraOptions wanted) : options(std::move(wanted)) {}

  // To be changed only while nothing reads from the camera.
  FakeEventCameraOptions options;

  // Record of the calls.
  std::vector<std::string> calls;  // "set_mode_slave", "enable main", ...
  int opens = 0;
  int starts = 0;  // attempted
  int stops = 0;
  int polls_in_vain = 0;  // polls that found no bytes
  bool streaming = false;
  bool anti_flicker = true;  // on, unlike real cameras: it must be switched off
  std::optional<uint32_t> rate_limit;

  // Throws, or returns whether the function is to succeed.
  bool MayDo(const std::string& function) const;
  void Start();
  void Stop();
  short Poll();
  std::vector<uint8_t> Take();  // empty: there is none

  void NoteOpen();
  // Waits until one of the counters above is that large.
  void WaitUntil(int FakeEventCamera::*counter, int count);

 private:
  void Count(int* counter);

  std::mutex mutex_;
  std::condition_variable counted_;
  FakeStream playing_;
  size_t next_ = 0;
};

// The cameras that the fake SDK finds. For one thread, except while a stream is read.
class FakeBus {
 public:
  static FakeBus& Get();

  // Removes all cameras and records.
  void Reset();
  std::shared_ptr<FakeEventCamera> Plug(FakeEventCameraOptions options);

  std::vector<std::shared_ptr<FakeEventCamera>> cameras;
  std::vector<std::string> opened;  // requested serial numbers
  int absences = 0;                 // number of further opens that find nothing
  bool list_throws = false;
};

}  // namespace rigcal::testing
