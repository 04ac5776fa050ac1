// What an exported component uses of Unreal Engine, for a syntax check without it.
#pragma once

template <typename Entry>
struct TArray {
  int Num() const { return 0; }
  Entry* GetData() { return nullptr; }
};

struct FVector {
  FVector(double, double, double) {}
};

struct FRotator {
  FRotator(double, double, double) {}
};

struct FTransform {
  FTransform() {}
  FTransform(FRotator, FVector) {}
  FTransform operator*(const FTransform&) const { return *this; }
};

struct FMath {
  static double RadiansToDegrees(double angle) { return angle; }
};

enum ELevelTick { LEVELTICK_All };
struct FActorComponentTickFunction {
  bool bCanEverTick = false;
};

#define UCLASS(...)
#define UPROPERTY(...)
#define GENERATED_BODY()
#define TEXT(text) text
#define ensureMsgf(condition, ...) ((void)(condition))
#define UE_LOG(category, level, text, ...) ((void)(__VA_ARGS__))
