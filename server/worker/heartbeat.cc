// SPDX-License-Identifier: Apache-2.0
#include "server/worker/heartbeat.h"

#include <time.h>

#include <cstddef>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

// It writes some bytes; the usual 8 MB would count towards the worker's memory.
constexpr size_t kStackBytes = size_t{256} << 10;
// Less is what the clocks are read with.
constexpr std::chrono::nanoseconds kLeastWork{500'000};

std::chrono::nanoseconds CpuTime(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

std::chrono::nanoseconds OthersCpuTime() {
  return CpuTime(CLOCK_PROCESS_CPUTIME_ID) - CpuTime(CLOCK_THREAD_CPUTIME_ID);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Heartbeat>> Heartbeat::Start(std::function<void()> beat,
                                                            std::chrono::milliseconds interval) {
  std::unique_ptr<Heartbeat> heartbeat(new Heartbeat(std::move(beat), interval));
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kStackBytes);
  const int error = pthread_create(&heartbeat->thread_, &attributes, &Run, heartbeat.get());
  pthread_attr_destroy(&attributes);
  if (error == 0) return heartbeat;
  heartbeat->stopping_ = true;  // there is nothing to wait for
  return absl::ResourceExhaustedError(
      absl::StrCat("no thread for the worker's signs of life: ", strerror(error)));
}

Heartbeat::~Heartbeat() {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) return;
    stopping_ = true;
  }
  wake_.notify_all();
  pthread_join(thread_, nullptr);
}

void* Heartbeat::Run(void* self) {
  static_cast<Heartbeat*>(self)->Loop();
  return nullptr;
}

void Heartbeat::Loop() {
  std::chrono::nanoseconds before = OthersCpuTime();
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (wake_.wait_for(lock, interval_, [this] { return stopping_; })) return;
    }
    const std::chrono::nanoseconds now = OthersCpuTime();
    if (now - before < kLeastWork) continue;
    before = now;
    beat_();
  }
}

}  // namespace rigcal::server
