// Tests of the C interface: they pass on Embree, and on the library that stands in for it.
#include "check.h"

int checks, failures;

void surfaces();
void changes();
void dynamics();
void callbacks();
void rounds();
void errors();
void packets();
void motions();
void starts();
void ties();
void crowds();

int main() {
  const struct {
    const char* name;
    void (*run)();
  } groups[] = {{"surfaces", surfaces}, {"changes", changes}, {"callbacks", callbacks},
                {"rounds", rounds},     {"errors", errors},   {"packets", packets},
                {"motions", motions},   {"starts", starts},   {"dynamics", dynamics}, {"ties", ties},         {"crowds", crowds}};
  int all = 0;
  for (const auto& group : groups) {
    checks = failures = 0;
    group.run();
    std::printf("%-10s %6d checks, %d failed\n", group.name, checks, failures);
    all += failures;
  }
  return all > 0;
}
