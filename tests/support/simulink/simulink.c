/* Stands where Simulink's simulink.c does, and drives the S-function as an engine would: rows from standard input, each
 * answered by forces and score on a line. */
#include <stdio.h>

static int read_row(SimStruct *S) {
  for (int n = 0; n < S->input_width; n++)
    if (scanf("%lf", &S->input[n]) != 1) return 0;
  return 1;
}

int main(void) {
  static SimStruct S;
  S.parameter.value = 0.01;
  mdlInitializeSizes(&S);
  mdlInitializeSampleTimes(&S);
  mdlStart(&S);
  mdlInitializeConditions(&S);
  for (int n = 0; n < S.works; n++)
    if (S.work_width[n] > STUB_WIDTH) return 3;
  while (read_row(&S)) {
    /* Twice, as an engine may: outputs must not move the memory on. */
    mdlOutputs(&S, 0);
    mdlOutputs(&S, 0);
    if (S.error) {
      printf("%s\n", S.error);
      return 2;
    }
    mdlUpdate(&S, 0);
    printf("%.17g %.17g %.17g %.17g\n", S.output[0][0], S.output[0][1], S.output[0][2], S.output[1][0]);
  }
  mdlTerminate(&S);
  return 0;
}
