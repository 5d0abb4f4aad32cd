// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "agent/capture/observation_source.h"
#include "agent/offer/camera_scan.h"
#include "agent/offer/chosen_cameras.h"
#include "common/session/offer.h"

namespace rigcal::agent {

// A camera that takes part because the configuration or the command line says so.
struct ConfiguredCamera {
  std::string camera;  // name within the rig
  std::string source;  // of its description: "aravis:192.168.1.5"
};

struct CameraOffersOptions {
  ScanOptions scan;
  std::chrono::milliseconds scan_interval{15'000};
};

// What cameras an agent offers, and which of them somebody has chosen. Scans, and opens the chosen
// ones, on a thread of its own; nothing is scanned or opened while a session is captured. A chosen
// camera that cannot be opened, because it is unplugged, is opened as soon as a scan sees it.
//
// Who has the agent's cameras makes the changes that come from here: it takes a Change, makes it
// and settles it. The answer to a request follows then. Any thread may call, unless it says
// otherwise.
class CameraOffers {
 public:
  // One of the agent's cameras to add or to remove.
  struct Change {
    std::unique_ptr<ObservationSource> added;  // null: `dropped` goes
    std::string dropped;
  };

  CameraOffers(CameraOffersOptions options, ChosenCameras chosen,
               std::vector<ConfiguredCamera> configured);
  ~CameraOffers() { Shutdown(); }
  CameraOffers(const CameraOffers&) = delete;
  CameraOffers& operator=(const CameraOffers&) = delete;

  // Opens those that were chosen before; the ones that cannot be opened now are logged and follow
  // as changes. Those that the configuration names, or whose name it gives to another camera, are
  // left out and logged. Once, before Start.
  std::vector<std::unique_ptr<ObservationSource>> OpenChosen();
  // Both are called on the thread of this object; `on_news` must neither block nor call back.
  void Start(std::function<void()> on_news, std::function<bool()> is_capturing);
  // Ends after what it does at the moment.
  void Shutdown();

  // Each request gets one answer.
  void Request(ChoiceRequest request);
  std::optional<ChoiceAnswer> TakeAnswer();
  // What is offered, if it is not what was taken last.
  std::optional<std::vector<OfferedCamera>> TakeOffer();
  // Drops requests and answers, because the server has gone, and offers everything again. A change
  // that is under way goes on.
  void Forget();

  // One at a time; the next one comes after Settle.
  std::optional<Change> TakeChange();
  void Settle(const absl::Status& status);
  // A change is under way, or the answer to its request is not taken.
  bool IsChanging();

 private:
  using Clock = std::chrono::steady_clock;
  // What is under way until Settle.
  struct Pending {
    enum class Kind : uint8_t { kUse, kDrop, kReturn };
    Kind kind;
    uint32_t request_id = 0;  // 0: nobody asked
    ChosenCamera camera;
  };

  void Run();
  void Handle(const ChoiceRequest& request);
  // OK: a Change is under way, or everything is done already.
  absl::Status Use(const ChoiceRequest& request);
  absl::Status Drop(const ChoiceRequest& request);
  absl::Status Finish(const Pending& pending, const absl::Status& status);
  absl::StatusOr<std::unique_ptr<ObservationSource>> Open(const ChosenCamera& camera) const;
  void Scan();
  // Opens one of the chosen cameras that are seen again.
  void OpenOneAgain();
  const SeenCamera* FindSeen(std::string_view device) const;
  const ConfiguredCamera* ConfiguredAs(const SeenCamera& seen) const;
  const ConfiguredCamera* FindConfigured(std::string_view camera) const;
  // Why the configuration does not let a chosen camera take part; empty: it does.
  std::string ConflictOf(const ChosenCamera& camera) const;
  std::vector<OfferedCamera> MakeOffer() const;
  void Publish();
  void Begin(Pending pending, Change change);
  void Answer(uint32_t request_id, const absl::Status& status);

  const CameraOffersOptions options_;
  const std::vector<ConfiguredCamera> configured_;
  std::function<void()> on_news_ = [] {};
  std::function<bool()> is_capturing_ = [] { return false; };

  // For thread_ once it runs.
  ChosenCameras chosen_;
  std::vector<SeenCamera> seen_;
  std::map<std::string, std::string> absent_;  // chosen cameras that do not run, and why
  std::deque<std::string> to_open_;            // of absent_, in this round
  std::string scan_fault_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<ChoiceRequest> requests_;
  std::deque<ChoiceAnswer> answers_;
  std::optional<Pending> pending_;
  std::optional<Change> change_;         // of pending_, until it is taken
  std::optional<absl::Status> settled_;  // of pending_
  std::vector<OfferedCamera> offer_;
  bool has_offer_ = false;  // a scan has ended
  bool offer_is_news_ = false;
  bool shut_down_ = false;
  std::thread thread_;
};

}  // namespace rigcal::agent
