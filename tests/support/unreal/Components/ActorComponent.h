// As CoreMinimal.h.
#pragma once

#include "../CoreMinimal.h"

struct AActor {
  FTransform GetActorTransform() { return FTransform(); }
  void SetActorTransform(const FTransform&) {}
};

class UActorComponent {
 public:
  typedef UActorComponent Super;
  virtual ~UActorComponent() {}
  virtual void BeginPlay() {}
  virtual void TickComponent(float, ELevelTick, FActorComponentTickFunction*) {}

 protected:
  FActorComponentTickFunction PrimaryComponentTick;
  AActor* GetOwner() { return nullptr; }
};
