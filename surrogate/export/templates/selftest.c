/* Runs the golden vectors of $name: leaves with 0, or with the number of the failed check. */
#include <stdio.h>

#include "$name.h"

int main(void) {
  const int failed = grouser_abi_matches(GROUSER_ABI_VERSION) ? grouser_self_test() : -1;
  if (failed)
    printf("$name: check %d failed\n", failed);
  else
    printf("$name: all checks passed (artifact %.12s)\n", grouser_artifact_hash);
  return failed != 0;
}
