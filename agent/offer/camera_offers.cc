// SPDX-License-Identifier: Apache-2.0
#include "agent/offer/camera_offers.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "agent/capture/registry/source_registry.h"
#include "common/status/guarded.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/text/printable.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMaxWaitingChoices = 64;
// A scan or a camera that was put off for a capture.
constexpr std::chrono::seconds kAfterCapture{2};
constexpr char kConfiguredWhere[] = "the agent's configuration or command line";

std::string NamesOf(const std::vector<SeenCamera>& seen) {
  if (seen.empty()) return "it sees none: is it powered and plugged in?";
  return absl::StrCat("it sees ",
                      absl::StrJoin(seen, ", ", [](std::string* out, const SeenCamera& camera) {
                        out->append(camera.offer.device);
                      }));
}

absl::Status WhileCapturing(const std::string& what) {
  return absl::FailedPreconditionError(
      absl::StrCat("the agent captures a session now, which nothing may disturb; ", what,
                   " when it has stopped: it counts from the next session on"));
}

}  // namespace

CameraOffers::CameraOffers(CameraOffersOptions options, ChosenCameras chosen,
                           std::vector<ConfiguredCamera> configured)
    : options_(std::move(options)),
      configured_(std::move(configured)),
      chosen_(std::move(chosen)) {}

std::vector<std::unique_ptr<ObservationSource>> CameraOffers::OpenChosen() {
  std::vector<std::unique_ptr<ObservationSource>> sources;
  // The configuration may name one of them by another of its names.
  if (!chosen_.cameras().empty() && !configured_.empty()) Scan();
  for (const ChosenCamera& camera : chosen_.cameras()) {
    if (const std::string conflict = ConflictOf(camera); !conflict.empty()) {
      spdlog::warn("camera {}: {}", camera.camera, conflict);
      absent_[camera.camera] = conflict;
      continue;
    }
    auto source = Open(camera);
    if (source.ok()) {
      sources.push_back(*std::move(source));
      continue;
    }
    absent_[camera.camera] = std::string(source.status().message());
    spdlog::error("{}; it takes part as soon as it can be opened",
                  std::string(source.status().message()));
  }
  return sources;
}

void CameraOffers::Start(std::function<void()> on_news, std::function<bool()> is_capturing) {
  on_news_ = std::move(on_news);
  is_capturing_ = std::move(is_capturing);
  thread_ = std::thread([this] { Run(); });
}

void CameraOffers::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    shut_down_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void CameraOffers::Request(ChoiceRequest request) {
  {
    const std::lock_guard lock(mutex_);
    if (requests_.size() >= kMaxWaitingChoices) requests_.pop_front();
    requests_.push_back(std::move(request));
  }
  changed_.notify_all();
}

std::optional<ChoiceAnswer> CameraOffers::TakeAnswer() {
  const std::lock_guard lock(mutex_);
  if (answers_.empty()) return std::nullopt;
  ChoiceAnswer answer = std::move(answers_.front());
  answers_.pop_front();
  return answer;
}

std::optional<std::vector<OfferedCamera>> CameraOffers::TakeOffer() {
  const std::lock_guard lock(mutex_);
  if (!std::exchange(offer_is_news_, false)) return std::nullopt;
  return offer_;
}

void CameraOffers::Forget() {
  const std::lock_guard lock(mutex_);
  requests_.clear();
  answers_.clear();
  if (pending_) pending_->request_id = 0;
  offer_is_news_ = has_offer_;
}

std::optional<CameraOffers::Change> CameraOffers::TakeChange() {
  const std::lock_guard lock(mutex_);
  return std::exchange(change_, std::nullopt);
}

void CameraOffers::Settle(const absl::Status& status) {
  {
    const std::lock_guard lock(mutex_);
    settled_ = status;
  }
  changed_.notify_all();
}

bool CameraOffers::IsChanging() {
  const std::lock_guard lock(mutex_);
  return pending_.has_value() || !answers_.empty();
}

void CameraOffers::Run() {
  Clock::time_point next_scan = Clock::now();
  std::unique_lock lock(mutex_);
  while (!shut_down_) {
    if (pending_) {
      if (!settled_) {
        changed_.wait(lock);
        continue;
      }
      const absl::Status status = *std::exchange(settled_, std::nullopt);
      const Pending pending = *pending_;
      lock.unlock();
      const absl::Status finished =
          Guarded("keeping a choice", [&] { return Finish(pending, status); });
      Publish();
      lock.lock();
      const uint32_t request_id = pending_->request_id;  // 0 since Forget
      pending_.reset();
      if (request_id != 0) answers_.push_back({.request_id = request_id, .status = finished});
      lock.unlock();
      on_news_();
      lock.lock();
    } else if (!requests_.empty()) {
      const ChoiceRequest request = std::move(requests_.front());
      requests_.pop_front();
      lock.unlock();
      Handle(request);
      lock.lock();
    } else if (!to_open_.empty()) {
      lock.unlock();
      const absl::Status status = Guarded("opening a camera", [&] { OpenOneAgain(); });
      if (!status.ok()) spdlog::error("{}", std::string(status.message()));
      lock.lock();
    } else if (Clock::now() >= next_scan) {
      lock.unlock();
      const bool is_capturing = is_capturing_();
      if (!is_capturing) {
        const absl::Status status = Guarded("looking for cameras", [&] {
          Scan();
          for (const auto& [camera, why] : absent_) to_open_.push_back(camera);
          Publish();
        });
        if (!status.ok()) spdlog::error("{}", std::string(status.message()));
      }
      next_scan =
          Clock::now() + (is_capturing ? Clock::duration(kAfterCapture) : options_.scan_interval);
      lock.lock();
    } else {
      changed_.wait_until(lock, next_scan);
    }
  }
}

void CameraOffers::Handle(const ChoiceRequest& request) {
  const absl::Status status = Guarded(
      "choosing a camera", [&] { return request.device.empty() ? Drop(request) : Use(request); });
  {
    const std::lock_guard lock(mutex_);
    if (status.ok() && pending_) return;
  }
  Publish();
  Answer(request.request_id, status);
}

absl::Status CameraOffers::Use(const ChoiceRequest& request) {
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera", request.camera));
  if (is_capturing_()) return WhileCapturing("choose the camera");
  const SeenCamera* seen = FindSeen(request.device);
  // It may have been plugged in, or given free, a moment ago.
  if (seen == nullptr || seen->offer.use != OfferedCamera::Use::kFree) {
    Scan();
    seen = FindSeen(request.device);
  }
  if (const ChosenCamera* const same = chosen_.FindDevice(request.device)) {
    if (same->camera == request.camera && request.calibration_yaml.empty()) {
      const auto absent = absent_.find(same->camera);
      if (absent == absent_.end()) return absl::OkStatus();
      return absl::FailedPreconditionError(absent->second);
    }
    return absl::AlreadyExistsError(absl::StrCat(
        "device ", same->device, " takes part as '", same->camera,
        "'; to give it another name or lens, drop it first: rigcal cameras drop ", same->camera));
  }
  if (seen == nullptr) {
    return absl::NotFoundError(absl::StrCat("the agent sees no camera '",
                                            Printable(Beginning(request.device, 64)), "'; ",
                                            NamesOf(seen_)));
  }
  if (const ConfiguredCamera* const same = ConfiguredAs(*seen)) {
    return absl::AlreadyExistsError(absl::StrCat("device ", request.device, " takes part as '",
                                                 same->camera, "' already, by ", kConfiguredWhere));
  }
  if (const ChosenCamera* const other = chosen_.FindCamera(request.camera)) {
    return absl::AlreadyExistsError(absl::StrCat("the name '", request.camera, "' is device ",
                                                 other->device,
                                                 "'s; give another name, or drop "
                                                 "that camera: rigcal cameras drop ",
                                                 request.camera));
  }
  if (FindConfigured(request.camera) != nullptr) {
    return absl::AlreadyExistsError(absl::StrCat("the name '", request.camera, "' is taken by ",
                                                 kConfiguredWhere, "; give another name"));
  }
  if (seen->offer.use != OfferedCamera::Use::kFree) {
    return absl::FailedPreconditionError(
        absl::StrCat("device ", request.device, ": ", seen->offer.note));
  }
  ChosenCamera camera{.device = seen->offer.device,
                      .kind = seen->offer.kind,
                      .source = seen->source,
                      .camera = request.camera,
                      .vendor = seen->offer.vendor,
                      .model = seen->offer.model,
                      .has_lens = !request.calibration_yaml.empty()};
  if (camera.has_lens) {
    RIGCAL_RETURN_IF_ERROR(chosen_.WriteLens(camera.camera, request.calibration_yaml));
  }
  auto source = Open(camera);
  if (!source.ok()) {
    if (camera.has_lens) chosen_.RemoveLens(camera.camera);
    // Whose file it is is known; where the agent has put it matters to nobody.
    const absl::StatusCode code = source.status().code();
    return absl::Status(
        code == absl::StatusCode::kUnavailable ? absl::StatusCode::kFailedPrecondition : code,
        absl::StrReplaceAll(source.status().message(),
                            {{chosen_.LensPath(camera.camera).string(), "the lens file"}}));
  }
  Begin({.kind = Pending::Kind::kUse, .request_id = request.request_id, .camera = camera},
        {.added = *std::move(source), .dropped = ""});
  return absl::OkStatus();
}

absl::Status CameraOffers::Drop(const ChoiceRequest& request) {
  const ChosenCamera* const camera = chosen_.FindCamera(request.camera);
  if (camera == nullptr) {
    if (FindConfigured(request.camera) != nullptr) {
      return absl::FailedPreconditionError(
          absl::StrCat("camera '", request.camera, "' is named by ", kConfiguredWhere,
                       "; take it out there, and start the agent again"));
    }
    const std::string names =
        absl::StrJoin(chosen_.cameras(), ", ",
                      [](std::string* out, const ChosenCamera& one) { out->append(one.camera); });
    return absl::NotFoundError(absl::StrCat(
        "no camera '", Printable(Beginning(request.camera, 64)), "' was chosen at this agent",
        names.empty() ? "; there is none" : absl::StrCat("; there are ", names)));
  }
  if (absent_.contains(request.camera)) {
    RIGCAL_RETURN_IF_ERROR(chosen_.Remove(request.camera));
    absent_.erase(request.camera);
    std::erase(to_open_, request.camera);
    return absl::OkStatus();
  }
  if (is_capturing_()) return WhileCapturing("drop the camera");
  Begin({.kind = Pending::Kind::kDrop, .request_id = request.request_id, .camera = *camera},
        {.added = nullptr, .dropped = request.camera});
  return absl::OkStatus();
}

absl::Status CameraOffers::Finish(const Pending& pending, const absl::Status& status) {
  const std::string& camera = pending.camera.camera;
  switch (pending.kind) {
    case Pending::Kind::kUse:
      if (!status.ok()) {
        if (pending.camera.has_lens) chosen_.RemoveLens(camera);
        return status;
      }
      if (const absl::Status kept = chosen_.Add(pending.camera); !kept.ok()) {
        return absl::InternalError(absl::StrCat("camera ", camera,
                                                " takes part until the agent ends, which cannot "
                                                "remember it: ",
                                                std::string(kept.message())));
      }
      spdlog::info("camera {}: device {} takes part from now on", camera, pending.camera.device);
      return absl::OkStatus();
    case Pending::Kind::kDrop:
      RIGCAL_RETURN_IF_ERROR(status);
      spdlog::info("camera {}: it takes no part any more", camera);
      if (const absl::Status kept = chosen_.Remove(camera); !kept.ok()) {
        return absl::InternalError(absl::StrCat("camera ", camera,
                                                " is dropped until the agent starts again, which "
                                                "cannot forget it: ",
                                                std::string(kept.message())));
      }
      return absl::OkStatus();
    case Pending::Kind::kReturn:
      if (status.ok()) {
        absent_.erase(camera);
        spdlog::info("camera {}: it is there again, and takes part", camera);
      }
      return status;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<ObservationSource>> CameraOffers::Open(
    const ChosenCamera& camera) const {
  std::vector<OptionText> lens;
  if (camera.has_lens) {
    lens.push_back({.key = "calibration", .value = chosen_.LensPath(camera.camera).string()});
  }
  RIGCAL_ASSIGN_OR_RETURN(const auto spec,
                          ParseSourceSpec(absl::StrCat(camera.camera, "=", camera.source), lens));
  return spec->Create();
}

void CameraOffers::Scan() {
  absl::StatusOr<std::vector<SeenCamera>> seen = ScanCameras(options_.scan);
  const std::string fault(seen.status().message());
  if (!seen.ok() && fault != scan_fault_) spdlog::warn("looking for cameras: {}", fault);
  scan_fault_ = seen.ok() ? "" : fault;
  if (seen.ok()) seen_ = *std::move(seen);
}

void CameraOffers::OpenOneAgain() {
  const std::string name = to_open_.front();
  to_open_.pop_front();
  const ChosenCamera* const camera = chosen_.FindCamera(name);
  if (camera == nullptr || !ConflictOf(*camera).empty() || is_capturing_()) return;
  const SeenCamera* const seen = FindSeen(camera->device);
  if (seen == nullptr && camera->kind != "sim") return;
  if (seen != nullptr && seen->offer.use != OfferedCamera::Use::kFree) {
    absent_[name] = seen->offer.note;
    return Publish();
  }
  auto source = Open(*camera);
  if (!source.ok()) {
    const std::string why(source.status().message());
    if (std::exchange(absent_[name], why) != why) spdlog::warn("{}", why);
    return Publish();
  }
  Begin({.kind = Pending::Kind::kReturn, .request_id = 0, .camera = *camera},
        {.added = *std::move(source), .dropped = ""});
}

const SeenCamera* CameraOffers::FindSeen(std::string_view device) const {
  const auto found =
      std::ranges::find(seen_, device, [](const SeenCamera& seen) { return seen.offer.device; });
  return found == seen_.end() ? nullptr : &*found;
}

const ConfiguredCamera* CameraOffers::ConfiguredAs(const SeenCamera& seen) const {
  const auto found = std::ranges::find_if(
      configured_, [&](const ConfiguredCamera& camera) { return seen.IsSource(camera.source); });
  return found == configured_.end() ? nullptr : &*found;
}

const ConfiguredCamera* CameraOffers::FindConfigured(std::string_view camera) const {
  const auto found = std::ranges::find(configured_, camera, &ConfiguredCamera::camera);
  return found == configured_.end() ? nullptr : &*found;
}

std::string CameraOffers::ConflictOf(const ChosenCamera& camera) const {
  const SeenCamera* const seen = FindSeen(camera.device);
  const ConfiguredCamera* same = seen == nullptr ? nullptr : ConfiguredAs(*seen);
  if (same == nullptr && FindConfigured(camera.camera) == nullptr) return "";
  return absl::StrCat("device ", camera.device, " was chosen as '", camera.camera, "', but ",
                      kConfiguredWhere,
                      same != nullptr ? absl::StrCat(" names it '", same->camera, "'")
                                      : std::string(" gives this name to another camera"),
                      ", and that holds; drop the choice: rigcal cameras drop ", camera.camera);
}

std::vector<OfferedCamera> CameraOffers::MakeOffer() const {
  using Use = OfferedCamera::Use;
  std::vector<OfferedCamera> offer;
  for (const SeenCamera& seen : seen_) {
    OfferedCamera& camera = offer.emplace_back(seen.offer);
    const ChosenCamera* const chosen = chosen_.FindDevice(camera.device);
    if (const ConfiguredCamera* const configured = ConfiguredAs(seen)) {
      camera.use = Use::kTakesPart;
      camera.camera = configured->camera;
      camera.configured = true;
      camera.note = chosen == nullptr ? "" : ConflictOf(*chosen);
    } else if (chosen != nullptr) {
      camera.camera = chosen->camera;
      const auto absent = absent_.find(chosen->camera);
      if (absent == absent_.end()) {
        camera.use = Use::kTakesPart;
        camera.note.clear();
      } else if (camera.note.empty()) {
        camera.note = absent->second;
      }
    }
  }
  for (const ChosenCamera& chosen : chosen_.cameras()) {
    if (FindSeen(chosen.device) != nullptr) continue;
    const auto absent = absent_.find(chosen.camera);
    const bool runs = absent == absent_.end();
    OfferedCamera camera{.device = chosen.device,
                         .kind = chosen.kind,
                         .vendor = chosen.vendor,
                         .model = chosen.model,
                         .use = Use::kGone,
                         .camera = chosen.camera};
    if (runs && (chosen.kind == "sim" || !scan_fault_.empty())) {
      camera.use = Use::kTakesPart;
    } else if (const std::string conflict = ConflictOf(chosen); !conflict.empty()) {
      camera.note = conflict;
    } else {
      camera.note =
          "it does not answer: is it powered and plugged in? It takes part again by itself when it "
          "does";
    }
    offer.push_back(std::move(camera));
  }
  std::ranges::sort(offer, {}, &OfferedCamera::device);
  return offer;
}

void CameraOffers::Publish() {
  std::vector<OfferedCamera> offer = MakeOffer();
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(has_offer_, true) && offer == offer_) return;
    offer_ = std::move(offer);
    offer_is_news_ = true;
  }
  on_news_();
}

void CameraOffers::Begin(Pending pending, Change change) {
  {
    const std::lock_guard lock(mutex_);
    pending_ = std::move(pending);
    change_ = std::move(change);
  }
  on_news_();
}

void CameraOffers::Answer(uint32_t request_id, const absl::Status& status) {
  if (request_id == 0) return;
  {
    const std::lock_guard lock(mutex_);
    answers_.push_back({.request_id = request_id, .status = status});
  }
  on_news_();
}

}  // namespace rigcal::agent
