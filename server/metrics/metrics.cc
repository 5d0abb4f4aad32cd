// SPDX-License-Identifier: Apache-2.0
#include "server/metrics/metrics.h"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <utility>
#include <vector>

namespace rigcal::server {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

// Families of metrics, one after the other.
class Families {
 public:
  void Gauge(const char* name, const char* help, double value, Labels labels = {}) {
    Family(name, help, MetricType::Gauge).metric.push_back(Labelled(std::move(labels)));
    families_.back().metric.back().gauge.value = value;
  }
  void Counter(const char* name, const char* help, double value, Labels labels = {}) {
    Family(name, help, MetricType::Counter).metric.push_back(Labelled(std::move(labels)));
    families_.back().metric.back().counter.value = value;
  }
  void Histogram(const char* name, const char* help, const SolveTimes::Counts& counts) {
    ClientMetric metric;
    metric.histogram.sample_count = counts.count;
    metric.histogram.sample_sum = counts.sum_s;
    for (size_t i = 0; i < counts.within.size(); ++i) {
      metric.histogram.bucket.push_back({counts.within[i], SolveTimes::kLimitsS[i]});
    }
    metric.histogram.bucket.push_back({counts.count, std::numeric_limits<double>::infinity()});
    Family(name, help, MetricType::Histogram).metric.push_back(std::move(metric));
  }

  std::string Text() const { return prometheus::TextSerializer().Serialize(families_); }

 private:
  // The last one goes on where it has this name.
  MetricFamily& Family(const char* name, const char* help, MetricType type) {
    if (families_.empty() || families_.back().name != name) {
      families_.push_back({name, help, type, {}});
    }
    return families_.back();
  }
  static ClientMetric Labelled(Labels labels) {
    ClientMetric metric;
    metric.label = std::move(labels);
    return metric;
  }

  std::vector<MetricFamily> families_;
};

double Number(uint64_t value) { return static_cast<double>(value); }

void AddIngest(const IngestStats& stats, Families* families) {
  constexpr char kName[] = "rigcal_ingest_observations_total";
  constexpr char kHelp[] = "Observations by what became of them.";
  families->Counter(kName, kHelp, Number(stats.stored_observation_count), {{"result", "stored"}});
  families->Counter(kName, kHelp, Number(stats.duplicate_observation_count),
                    {{"result", "duplicate"}});
  families->Counter(kName, kHelp, Number(stats.refused_observation_count), {{"result", "refused"}});
  families->Counter(kName, kHelp, Number(stats.conflict_observation_count),
                    {{"result", "conflict"}});
  families->Counter("rigcal_ingest_commits_total", "Transactions of ingest.",
                    Number(stats.commit_count));
  families->Gauge("rigcal_ingest_queue_bytes", "Deliveries that wait for the disk.",
                  Number(stats.queue_bytes));
  families->Gauge("rigcal_ingest_up", "1 while observations are accepted.",
                  stats.problem.empty() ? 1 : 0);
}

void AddStore(const StoreHealth& health, Families* families) {
  families->Gauge("rigcal_store_size_bytes", "Size of the database.", Number(health.size_bytes));
  families->Gauge("rigcal_store_unused_bytes", "Part of it that holds nothing.",
                  Number(health.unused_bytes));
  families->Gauge("rigcal_store_disk_free_bytes", "Free space on its disk.",
                  Number(health.free_bytes));
  families->Gauge("rigcal_store_disk_reserve_bytes",
                  "Free space at which observations are refused.", Number(health.reserve_bytes));
  families->Gauge("rigcal_store_up", "1 while the database can be written.",
                  health.problem.empty() ? 1 : 0);
}

void AddAgents(const std::vector<AgentRecord>& agents, Families* families) {
  for (const AgentRecord& agent : agents) {
    families->Gauge("rigcal_agent_connected", "1 while the agent has a stream.",
                    agent.connected ? 1 : 0, {{"agent", agent.agent_id}, {"rig", agent.rig}});
  }
  for (const AgentRecord& agent : agents) {
    if (!agent.spool) continue;
    families->Gauge("rigcal_agent_spool_rows", "Observations in the agent's spool.",
                    Number(agent.spool->row_count), {{"agent", agent.agent_id}});
  }
  for (const AgentRecord& agent : agents) {
    if (!agent.spool) continue;
    families->Gauge("rigcal_agent_spool_bytes", "Size of the agent's spool.",
                    Number(agent.spool->bytes), {{"agent", agent.agent_id}});
  }
}

uint64_t DrainingCount(const SessionCoordinator& coordinator) {
  return static_cast<uint64_t>(
      std::ranges::count(coordinator.ActiveSessions(), SessionState::kDraining, &Session::state));
}

void AddPorts(const PortCounts& grpc, const WebCounts& web, Families* families) {
  const std::pair<const char*, PortCounts> ports[] = {{"grpc", grpc}, {"http", web.connections}};
  for (const auto& [port, counts] : ports) {
    families->Gauge("rigcal_connections_open", "Open connections.", Number(counts.open),
                    {{"port", port}});
  }
  for (const auto& [port, counts] : ports) {
    families->Counter("rigcal_connections_accepted_total", "Connections that were accepted.",
                      Number(counts.accepted), {{"port", port}});
  }
  for (const auto& [port, counts] : ports) {
    families->Counter("rigcal_connections_refused_total",
                      "Connections that were refused, or closed to make room.",
                      Number(counts.refused), {{"port", port}});
  }
  families->Counter("rigcal_http_requests_total", "Requests to the HTTP port.",
                    Number(web.requests));
  families->Counter("rigcal_http_refused_requests_total",
                    "Requests that were answered with a status of 400 or more.",
                    Number(web.refused_requests));
}

void AddProcess(Families* families) {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  families->Counter("process_cpu_seconds_total", "Time on the CPU, seconds.",
                    seconds(usage.ru_utime) + seconds(usage.ru_stime));
  std::ifstream statm("/proc/self/statm");
  uint64_t pages = 0;
  uint64_t resident_pages = 0;
  if (statm >> pages >> resident_pages) {
    const auto page_bytes = static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
    families->Gauge("process_resident_memory_bytes", "Memory in use.",
                    Number(resident_pages * page_bytes));
    families->Gauge("process_virtual_memory_bytes", "Address space.", Number(pages * page_bytes));
  }
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) == 0) {
    families->Gauge("process_max_fds", "Most descriptors that may be open.",
                    Number(limit.rlim_cur));
  }
  std::error_code error;
  uint64_t descriptors = 0;
  for (std::filesystem::directory_iterator each("/proc/self/fd", error), end; !error && each != end;
       each.increment(error)) {
    ++descriptors;
  }
  families->Gauge("process_open_fds", "Open descriptors.", Number(descriptors));
}

}  // namespace

std::string MetricsText(const MetricsSources& sources) {
  Families families;
  families.Gauge("rigcal_info", "Release of the server.", 1,
                 {{"version", sources.software_version}});
  AddIngest(sources.ingest->Stats(), &families);
  AddStore(sources.store->Health(), &families);
  families.Gauge("rigcal_agents_connected", "Agents with an open stream.",
                 Number(sources.directory->ConnectedCount()));
  AddAgents(sources.directory->List(""), &families);
  families.Gauge("rigcal_sessions", "Sessions in the store.",
                 Number(sources.coordinator->SessionCount()));
  families.Gauge("rigcal_sessions_capturing", "Sessions that capture.",
                 Number(sources.coordinator->CapturingCount()));
  families.Gauge("rigcal_sessions_draining", "Stopped sessions that wait for observations.",
                 Number(DrainingCount(*sources.coordinator)));
  families.Gauge("rigcal_calibrations_queued", "Calibrations that wait for the worker.",
                 Number(sources.runner->QueuedCount()));
  const SolveTimes::Counts solves = sources.solves->Get();
  families.Histogram("rigcal_solve_seconds", "How long solves took.", solves);
  families.Counter("rigcal_solves_failed_total", "Solves without a result.", Number(solves.failed));
  AddPorts(sources.grpc(), sources.web(), &families);
  AddProcess(&families);
  return families.Text();
}

std::string StandbyMetricsText(const StandbyFigures& figures) {
  Families families;
  families.Gauge("rigcal_standby", "1: this server follows another one and answers nobody.", 1,
                 {{"primary", figures.primary}});
  families.Gauge("rigcal_standby_complete", "1 once it has had everything of its primary.",
                 figures.complete ? 1 : 0);
  families.Gauge("rigcal_standby_follows", "1 while copying works.", figures.follows ? 1 : 0);
  families.Gauge("rigcal_standby_behind_observations",
                 "Observations that the primary had more, when it last answered.",
                 Number(figures.behind_count));
  if (figures.silence_s >= 0) {
    families.Gauge("rigcal_standby_silence_seconds", "Since the primary last answered.",
                   figures.silence_s);
  }
  AddProcess(&families);
  return families.Text();
}

}  // namespace rigcal::server
