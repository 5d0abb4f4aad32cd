// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/experiment.h"

int main(int argc, char** argv) {
  return rigcal::accuracy::RunExperiment(rigcal::accuracy::AllExperiments(), argc, argv);
}
