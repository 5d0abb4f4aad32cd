// SPDX-License-Identifier: Apache-2.0
#include "server/session/change_notifier.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::server {

absl::StatusOr<std::unique_ptr<ChangeNotifier::Watch>> ChangeNotifier::Add(
    std::string_view id, std::function<void()> wake) {
  std::lock_guard lock(mutex_);
  if (watches_.size() >= max_watches_) {
    return absl::ResourceExhaustedError(
        absl::StrCat(watches_.size(),
                     " clients are watching, which is the limit; try again later, "
                     "or get the resource from time to time instead"));
  }
  std::unique_ptr<Watch> watch(new Watch(this, id, std::move(wake)));
  watch->place_ = watches_.insert(watches_.end(), watch.get());
  return watch;
}

void ChangeNotifier::Notify(std::string_view id) {
  std::lock_guard lock(mutex_);
  for (const Watch* watch : watches_) {
    if (watch->id_ == id) watch->wake_();
  }
}

ChangeNotifier::Watch::~Watch() {
  std::lock_guard lock(notifier_->mutex_);
  notifier_->watches_.erase(place_);
}

}  // namespace rigcal::server
