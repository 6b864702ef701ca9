"""What a proposal is: network, scheduler, fusion."""
