// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/fake_metavision/fake_event_camera.h"

#include "metavision/hal/utils/hal_exception.h"

namespace rigcal::testing {

bool FakeEventCamera::MayDo(const std::string& function) const {
  if (options.throwing_odd.contains(function)) throw 42;
  if (options.throwing.contains(function)) {
    throw Metavision::HalException(0x101000, function + " failed");
  }
  return !options.refusing.contains(function);
}

void FakeEventCamera::Start() {
  Count(&starts);
  MayDo("I_EventsStream::start");
  const std::lock_guard lock(mutex_);
  streaming = true;
  next_ = 0;
  playing_ = {};
  if (options.streams.empty()) return;
  playing_ = std::move(options.streams.front());
  options.streams.pop_front();
}

void FakeEventCamera::Stop() {
  {
    const std::lock_guard lock(mutex_);
    streaming = false;
  }
  Count(&stops);
  MayDo("I_EventsStream::stop");
}

short FakeEventCamera::Poll() {
  MayDo("I_EventsStream::poll_buffer");
  std::unique_lock lock(mutex_);
  if (!streaming) return -1;
  if (next_ < playing_.pieces.size()) return 1;
  if (playing_.then == FakeStream::Then::kEnd) return -1;
  if (playing_.then == FakeStream::Then::kThrow) {
    throw Metavision::HalException(0x100000, "the device is gone");
  }
  lock.unlock();
  Count(&polls_in_vain);
  return 0;
}

std::vector<uint8_t> FakeEventCamera::Take() {
  MayDo("I_EventsStream::get_latest_raw_data");
  const std::lock_guard lock(mutex_);
  if (next_ == playing_.pieces.size()) return {};
  return std::move(playing_.pieces[next_++]);
}

void FakeEventCamera::NoteOpen() { Count(&opens); }

void FakeEventCamera::Count(int* counter) {
  {
    const std::lock_guard lock(mutex_);
    ++*counter;
  }
  counted_.notify_all();
}

void FakeEventCamera::WaitUntil(int FakeEventCamera::*counter, int count) {
  std::unique_lock lock(mutex_);
  counted_.wait(lock, [&] { return this->*counter >= count; });
}

FakeBus& FakeBus::Get() {
  static auto* const kBus = new FakeBus();
  return *kBus;
}

void FakeBus::Reset() { *this = FakeBus(); }

std::shared_ptr<FakeEventCamera> FakeBus::Plug(FakeEventCameraOptions options) {
  return cameras.emplace_back(std::make_shared<FakeEventCamera>(std::move(options)));
}

}  // namespace rigcal::testing
