// SPDX-License-Identifier: Apache-2.0
#include "server/session/change_notifier.h"

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace rigcal::server {

absl::StatusOr<std::unique_ptr<ChangeNotifier::Watch>> ChangeNotifier::Add(std::string_view id) {
  std::lock_guard lock(mutex_);
  if (shutdown_) return absl::UnavailableError("the server is shutting down");
  if (watches_.size() >= max_watches_) {
    return absl::ResourceExhaustedError(
        absl::StrCat(watches_.size(),
                     " clients are watching, which is the limit; ask again later, "
                     "or get the resource now and then instead"));
  }
  std::unique_ptr<Watch> watch(new Watch(this, id));
  watch->place_ = watches_.insert(watches_.end(), watch.get());
  return watch;
}

void ChangeNotifier::Notify(std::string_view id) {
  std::lock_guard lock(mutex_);
  for (Watch* watch : watches_) {
    if (watch->id_ != id) continue;
    watch->changed_ = true;
    watch->condition_.notify_all();
  }
}

void ChangeNotifier::Shutdown() {
  std::lock_guard lock(mutex_);
  shutdown_ = true;
  for (Watch* watch : watches_) watch->condition_.notify_all();
}

ChangeNotifier::Watch::~Watch() {
  std::lock_guard lock(notifier_->mutex_);
  notifier_->watches_.erase(place_);
}

ChangeNotifier::Event ChangeNotifier::Watch::Wait(std::chrono::milliseconds timeout) {
  std::unique_lock lock(notifier_->mutex_);
  const bool woken =
      condition_.wait_for(lock, timeout, [this] { return changed_ || notifier_->shutdown_; });
  if (notifier_->shutdown_) return Event::kShutdown;
  if (!woken) return Event::kTimeout;
  changed_ = false;
  return Event::kChanged;
}

bool ChangeNotifier::Watch::Pause(std::chrono::milliseconds time) {
  std::unique_lock lock(notifier_->mutex_);
  return !condition_.wait_for(lock, time, [this] { return notifier_->shutdown_; });
}

}  // namespace rigcal::server
