// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <memory>

#include "metavision/hal/facilities/i_registrable_facility.h"
#include "metavision/hal/utils/data_transfer.h"

namespace rigcal::testing {
class FakeEventCamera;
}

namespace Metavision {

class I_EventsStream : public I_RegistrableFacility<I_EventsStream> {
 public:
  using RawData = DataTransfer::Data;

  explicit I_EventsStream(std::shared_ptr<rigcal::testing::FakeEventCamera> camera)
      : camera_(std::move(camera)) {}
  ~I_EventsStream() override;

  void start();
  void stop();
  // 1: there are bytes; 0: none yet; -1: there will be none.
  short poll_buffer();
#if FAKE_METAVISION_MAJOR >= 5
  DataTransfer::BufferPtr get_latest_raw_data();
#else
  // Good until the next call or the stop; the fake one spoils it then.
  RawData* get_latest_raw_data(long& n_rawbytes);
#endif

 private:
  const std::shared_ptr<rigcal::testing::FakeEventCamera> camera_;
#if FAKE_METAVISION_MAJOR < 5
  void Spoil();
  std::shared_ptr<std::vector<RawData>> returned_;
#endif
};

}  // namespace Metavision
